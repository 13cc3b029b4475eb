"""The coefficient form: forces and moment as coefficients over the airflow, airspeed and its pressure moving."""
